; A lock: doors that are open only while somebody holds their switch (MA-PDDL, action formulas).
;
; hold has no effect on the state.  It matters because pass needs that another robot does it in the same step.
; It is a lock, so two different doors are never open in the same step: a negative formula.
(define (domain lock)
  (:requirements :typing :equality :negative-preconditions :disjunctive-preconditions :universal-preconditions
                 :existential-preconditions :multi-agent)
  (:types robot room door)
  (:predicates
    (at ?r - robot ?p - room)
    (joins ?d - door ?a ?b - room)              ; in both directions
    (switch ?d - door ?p - room)                ; the door has a switch in this room
    (way ?a ?b - room))                         ; without a door, in both directions

  (:action walk
    :agent ?r - robot
    :parameters (?from ?to - room)
    :precondition (and (at ?r ?from) (way ?from ?to))
    :effect (and (not (at ?r ?from)) (at ?r ?to)))

  (:action hold
    :agent ?r - robot
    :parameters (?d - door ?p - room)
    :precondition (and
      (at ?r ?p)
      (switch ?d ?p)
      (forall (?o - robot ?e - door ?q - room)
        (or (= ?e ?d) (not (hold ?o ?e ?q))))))

  (:action pass
    :agent ?r - robot
    :parameters (?d - door ?from ?to - room)
    :precondition (and
      (at ?r ?from)
      (joins ?d ?from ?to)
      (exists (?o - robot ?p - room) (and (not (= ?o ?r)) (hold ?o ?d ?p))))
    :effect (and (not (at ?r ?from)) (at ?r ?to)))
)
