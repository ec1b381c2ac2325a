; Robots that cannot leave their room hand parcels to each other through a door (plain typed PDDL).
;
; The robots are the objects of type robot.  A ground action belongs to the robots among its arguments, so hand-over,
; which has two of them, is a shared subaction: it happens only in a step in which both robots choose it.
(define (domain handover)
  (:requirements :strips :typing)
  (:types robot place parcel)
  (:predicates
    (at ?r - robot ?p - place)
    (free ?r - robot)                           ; holds nothing
    (holds ?r - robot ?b - parcel)
    (lies ?b - parcel ?p - place)
    (path ?a ?b - place)                        ; inside a room, in both directions
    (door ?a ?b - place)                        ; the two sides of a door, in both directions; no robot fits through
    (table ?p - place))                         ; parcels lie on tables only

  (:action go
    :parameters (?r - robot ?from ?to - place)
    :precondition (and (at ?r ?from) (path ?from ?to))
    :effect (and (not (at ?r ?from)) (at ?r ?to)))

  (:action pick-up
    :parameters (?r - robot ?b - parcel ?p - place)
    :precondition (and (at ?r ?p) (lies ?b ?p) (free ?r))
    :effect (and (not (lies ?b ?p)) (not (free ?r)) (holds ?r ?b)))

  (:action put-down
    :parameters (?r - robot ?b - parcel ?p - place)
    :precondition (and (at ?r ?p) (table ?p) (holds ?r ?b))
    :effect (and (not (holds ?r ?b)) (free ?r) (lies ?b ?p)))

  (:action hand-over
    :parameters (?giver ?taker - robot ?b - parcel ?here ?there - place)
    :precondition (and (at ?giver ?here) (at ?taker ?there) (door ?here ?there) (holds ?giver ?b) (free ?taker))
    :effect (and (not (holds ?giver ?b)) (free ?giver) (not (free ?taker)) (holds ?taker ?b)))
)
