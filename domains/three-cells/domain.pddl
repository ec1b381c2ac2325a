; Written by domains/generate.py: the domain of ../grid under this name.
;
; Robots that move from cell to cell, all at the same time (MA-PDDL).
;
; A step: every robot moves to an adjacent cell or stays where it is.  Staying is the implicit idling of a joint
; step, so there is no action for it.  What may not happen:
;   - two robots in one cell, before or after the step;
;   - a swap: two robots that exchange their cells in one step.
; Following is allowed: a robot may enter the cell that another one leaves in the same step, also in a ring of three
; or more robots of which each takes the place of the next.
(define (domain three-cells)
  (:requirements :typing :equality :negative-preconditions :disjunctive-preconditions
                 :universal-preconditions :existential-preconditions :multi-agent)
  (:types robot cell - object)
  (:predicates
    (at ?r - robot ?c - cell)
    (adjacent ?a ?b - cell))                    ; in both directions

  (:action move
    :agent ?r - robot
    :parameters (?from ?to - cell)
    :precondition (and
      (at ?r ?from)
      (adjacent ?from ?to)
      ; Whoever stands in the cell moves out of it in the same step.  (The adjacency only saves work in grounding.)
      (forall (?o - robot)
        (or (= ?o ?r)
            (not (at ?o ?to))
            (exists (?next - cell) (and (adjacent ?to ?next) (move ?o ?to ?next)))))
      ; Nobody else moves into it.  (So says the interference rule, too; this is for readers that have none.)
      (forall (?o - robot ?other - cell)
        (or (= ?o ?r)
            (not (adjacent ?other ?to))
            (not (move ?o ?other ?to))))
      ; Nobody comes the other way.
      (forall (?o - robot)
        (not (move ?o ?to ?from))))
    :effect (and
      (not (at ?r ?from))
      (at ?r ?to)))
)
