; Three robots raise flags, and the parade starts if two of them show the same colour.
(define (domain flags)
  (:requirements :typing :negative-preconditions :existential-preconditions :equality :multi-agent)
  (:types robot colour)
  (:predicates
    (waits ?r - robot)
    (shows ?r - robot ?c - colour)
    (marched ?r - robot))

  (:action raise
    :agent ?r - robot
    :parameters (?c - colour)
    :precondition (waits ?r)
    :effect (and (not (waits ?r)) (shows ?r ?c)))

  ; Nobody marches unless some colour is shown twice.
  (:action march
    :agent ?r - robot
    :parameters ()
    :precondition (and
      (not (waits ?r))
      (not (marched ?r))
      (exists (?c - colour ?x ?y - robot) (and (not (= ?x ?y)) (shows ?x ?c) (shows ?y ?c))))
    :effect (marched ?r)))
