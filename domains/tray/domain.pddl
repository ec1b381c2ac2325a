; Two robots lift and carry a tray with full glasses (MA-PDDL, action formulas, also in effect conditions).
;
; One end may be lifted or lowered alone, but then the glasses slide: the condition of the effect speaks of the same
; joint step.  Carrying is possible only together, which is a precondition.
(define (domain tray)
  (:requirements :typing :equality :negative-preconditions :existential-preconditions :conditional-effects :multi-agent)
  (:types robot end place)
  (:predicates
    (at ?r - robot ?p - place)
    (free ?r - robot)
    (holds ?r - robot ?e - end)
    (down ?e - end)
    (tray-at ?p - place)
    (spilled)
    (way ?a ?b - place))                        ; in both directions

  (:action walk
    :agent ?r - robot
    :parameters (?from ?to - place)
    :precondition (and (at ?r ?from) (free ?r) (way ?from ?to))
    :effect (and (not (at ?r ?from)) (at ?r ?to)))

  (:action lift
    :agent ?r - robot
    :parameters (?e - end ?p - place)
    :precondition (and (at ?r ?p) (tray-at ?p) (free ?r) (down ?e))
    :effect (and
      (not (down ?e)) (not (free ?r)) (holds ?r ?e)
      (when (not (exists (?o - robot ?f - end) (and (not (= ?f ?e)) (lift ?o ?f ?p))))
        (spilled))))

  (:action lower
    :agent ?r - robot
    :parameters (?e - end ?p - place)
    :precondition (and (at ?r ?p) (tray-at ?p) (holds ?r ?e))
    :effect (and
      (not (holds ?r ?e)) (free ?r) (down ?e)
      (when (not (exists (?o - robot ?f - end) (and (not (= ?f ?e)) (lower ?o ?f ?p))))
        (spilled))))

  (:action carry
    :agent ?r - robot
    :parameters (?e - end ?from ?to - place)
    :precondition (and
      (at ?r ?from) (tray-at ?from) (holds ?r ?e) (way ?from ?to)
      (exists (?o - robot ?f - end) (and (not (= ?o ?r)) (not (= ?f ?e)) (carry ?o ?f ?from ?to))))
    :effect (and (not (at ?r ?from)) (at ?r ?to) (not (tray-at ?from)) (tray-at ?to)))
)
