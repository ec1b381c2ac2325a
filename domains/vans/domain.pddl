; Drivers and vans: agents of two types (MA-PDDL), and action costs.
;
; A van drives while somebody is at its wheel.  That nobody gets out of a driving van, or into it, follows from the
; interference rule.  Driving costs fuel, by distance; it counts with --cost makespan+cost only.
(define (domain vans)
  (:requirements :typing :existential-preconditions :action-costs :multi-agent)
  (:types driver van place)
  (:predicates
    (at ?x - (either driver van) ?p - place)
    (aboard ?d - driver ?v - van)
    (vacant ?v - van)                           ; one seat, the driver's
    (road ?a ?b - place)                        ; in both directions
    (path ?a ?b - place))                       ; for walking, in both directions
  (:functions
    (total-cost) - number
    (distance ?a ?b - place) - number)

  (:action walk
    :agent ?d - driver
    :parameters (?from ?to - place)
    :precondition (and (at ?d ?from) (path ?from ?to))
    :effect (and (not (at ?d ?from)) (at ?d ?to)))

  (:action board
    :agent ?d - driver
    :parameters (?v - van ?p - place)
    :precondition (and (at ?d ?p) (at ?v ?p) (vacant ?v))
    :effect (and (not (at ?d ?p)) (not (vacant ?v)) (aboard ?d ?v)))

  (:action alight
    :agent ?d - driver
    :parameters (?v - van ?p - place)
    :precondition (and (aboard ?d ?v) (at ?v ?p))
    :effect (and (not (aboard ?d ?v)) (vacant ?v) (at ?d ?p)))

  (:action drive
    :agent ?v - van
    :parameters (?from ?to - place)
    :precondition (and (at ?v ?from) (road ?from ?to) (exists (?d - driver) (aboard ?d ?v)))
    :effect (and (not (at ?v ?from)) (at ?v ?to) (increase (total-cost) (distance ?from ?to))))
)
