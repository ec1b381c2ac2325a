; The grid domain for two robots, r1 and r2, as plain PDDL in which every action is a whole joint action.
;
; The "subaction" comments say what each robot does in it; any planner for plain PDDL may ignore them.  The schemas
; are disjoint, and their preconditions are conjunctions of literals, so no joint action is grounded twice.  A step
; in which nobody moves is left out: it changes nothing and is in no optimal plan.
(define (domain grid-joint)
  (:requirements :typing :equality :negative-preconditions)
  (:types robot cell - object)
  (:constants r1 r2 - robot)
  (:predicates
    (at ?r - robot ?c - cell)
    (adjacent ?a ?b - cell))                    ; in both directions

  ; Both move, neither into the cell of the other.
  (:action move-apart
    ; subaction r1 (move ?f1 ?t1)
    ; subaction r2 (move ?f2 ?t2)
    :parameters (?f1 ?t1 ?f2 ?t2 - cell)
    :precondition (and
      (at r1 ?f1) (adjacent ?f1 ?t1)
      (at r2 ?f2) (adjacent ?f2 ?t2)
      (not (= ?t1 ?t2))
      (not (= ?t1 ?f2))
      (not (= ?t2 ?f1)))
    :effect (and
      (not (at r1 ?f1)) (at r1 ?t1)
      (not (at r2 ?f2)) (at r2 ?t2)))

  ; r1 moves into the cell that r2 leaves; r2 does not move into the cell of r1, that would be a swap.
  (:action r1-follows
    ; subaction r1 (move ?f1 ?f2)
    ; subaction r2 (move ?f2 ?t2)
    :parameters (?f1 ?f2 ?t2 - cell)
    :precondition (and
      (at r1 ?f1) (adjacent ?f1 ?f2)
      (at r2 ?f2) (adjacent ?f2 ?t2)
      (not (= ?t2 ?f1)))
    :effect (and
      (not (at r1 ?f1)) (at r1 ?f2)
      (not (at r2 ?f2)) (at r2 ?t2)))

  ; r2 moves into the cell that r1 leaves.
  (:action r2-follows
    ; subaction r1 (move ?f1 ?t1)
    ; subaction r2 (move ?f2 ?f1)
    :parameters (?f1 ?t1 ?f2 - cell)
    :precondition (and
      (at r1 ?f1) (adjacent ?f1 ?t1)
      (at r2 ?f2) (adjacent ?f2 ?f1)
      (not (= ?t1 ?f2)))
    :effect (and
      (not (at r1 ?f1)) (at r1 ?t1)
      (not (at r2 ?f2)) (at r2 ?f1)))

  ; Only r1 moves, into a cell where r2 is not.
  (:action r1-moves
    ; subaction r1 (move ?f1 ?t1)
    ; subaction r2 idle
    :parameters (?f1 ?t1 ?c2 - cell)
    :precondition (and
      (at r1 ?f1) (adjacent ?f1 ?t1)
      (at r2 ?c2)
      (not (= ?t1 ?c2)))
    :effect (and
      (not (at r1 ?f1)) (at r1 ?t1)))

  ; Only r2 moves, into a cell where r1 is not.
  (:action r2-moves
    ; subaction r1 idle
    ; subaction r2 (move ?f2 ?t2)
    :parameters (?c1 ?f2 ?t2 - cell)
    :precondition (and
      (at r1 ?c1)
      (at r2 ?f2) (adjacent ?f2 ?t2)
      (not (= ?t2 ?c1)))
    :effect (and
      (not (at r2 ?f2)) (at r2 ?t2)))
)
