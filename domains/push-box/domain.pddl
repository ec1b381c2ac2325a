; A box that is too heavy for one robot (MA-PDDL, action formulas).
;
; Positive formula: push needs another robot that pushes the same box the same way in the same step.
; Negative formula: while a box is pushed through a door, nobody else walks through it.
; A joint push also breaks what interference would forbid (each deletes (stands ..), which the other one needs): the
; positive formula says that the two are meant to be done together.
(define (domain push-box)
  (:requirements :typing :equality :negative-preconditions :universal-preconditions :existential-preconditions
                 :multi-agent)
  (:types robot box room)
  (:predicates
    (at ?r - robot ?p - room)
    (stands ?b - box ?p - room)
    (door ?a ?b - room))                        ; in both directions

  (:action go
    :agent ?r - robot
    :parameters (?from ?to - room)
    :precondition (and
      (at ?r ?from)
      (door ?from ?to)
      (forall (?o - robot ?b - box)
        (and (not (push ?o ?b ?from ?to)) (not (push ?o ?b ?to ?from)))))
    :effect (and (not (at ?r ?from)) (at ?r ?to)))

  (:action push
    :agent ?r - robot
    :parameters (?b - box ?from ?to - room)
    :precondition (and
      (at ?r ?from)
      (stands ?b ?from)
      (door ?from ?to)
      (exists (?o - robot) (and (not (= ?o ?r)) (push ?o ?b ?from ?to))))
    :effect (and
      (not (at ?r ?from)) (at ?r ?to)
      (not (stands ?b ?from)) (stands ?b ?to)))
)
