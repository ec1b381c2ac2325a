; Robots in a house with an elevator, which is one of the robots (plain typed PDDL with a conditional effect over all).
;
; The robots are the objects of type robot, those of its two subtypes.  When the elevator moves it takes along everybody
; who is inside: a universal effect with a condition.
(define (domain elevator)
  (:requirements :typing :universal-preconditions :conditional-effects)
  (:types
    floor robot - object
    walker elevator - robot)
  (:predicates
    (stops ?f - floor)                          ; where the cabin is
    (on ?w - walker ?f - floor)                 ; also inside the cabin
    (inside ?w - walker)
    (outside ?w - walker)
    (next ?a ?b - floor))                       ; in both directions

  (:action enter
    :parameters (?w - walker ?f - floor)
    :precondition (and (outside ?w) (on ?w ?f) (stops ?f))
    :effect (and (not (outside ?w)) (inside ?w)))

  (:action leave
    :parameters (?w - walker ?f - floor)
    :precondition (and (inside ?w) (stops ?f))
    :effect (and (not (inside ?w)) (outside ?w)))

  (:action move
    :parameters (?e - elevator ?from ?to - floor)
    :precondition (and (stops ?from) (next ?from ?to))
    :effect (and
      (not (stops ?from))
      (stops ?to)
      (forall (?w - walker)
        (when (inside ?w) (and (not (on ?w ?from)) (on ?w ?to))))))
)
