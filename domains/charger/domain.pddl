; Cleaning robots that share one charger (MA-PDDL, a negative action formula).
;
; A charge lasts for mopping one room.  The charger serves one robot in each step: charge forbids that another robot
; charges there, too.
(define (domain charger)
  (:requirements :typing :negative-preconditions :universal-preconditions :multi-agent)
  (:types robot room charger)
  (:predicates
    (at ?r - robot ?p - room)
    (charged ?r - robot)
    (clean ?p - room)
    (installed ?c - charger ?p - room)
    (door ?a ?b - room))                        ; in both directions

  (:action go
    :agent ?r - robot
    :parameters (?from ?to - room)
    :precondition (and (at ?r ?from) (door ?from ?to))
    :effect (and (not (at ?r ?from)) (at ?r ?to)))

  (:action charge
    :agent ?r - robot
    :parameters (?c - charger ?p - room)
    :precondition (and
      (at ?r ?p)
      (installed ?c ?p)
      (not (charged ?r))
      (forall (?o - robot) (not (charge ?o ?c ?p))))
    :effect (charged ?r))

  (:action mop
    :agent ?r - robot
    :parameters (?p - room)
    :precondition (and (at ?r ?p) (charged ?r) (not (clean ?p)))
    :effect (and (not (charged ?r)) (clean ?p)))
)
