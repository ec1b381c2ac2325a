; Two robot arms over one table (STRIPS without types).
;
; Who is what is told by unary predicates, as in old domains.  The robots are the objects of which (robot ..) is true;
; such a predicate of the name robot is found without an option.  That two arms do not collide is left to the
; interference rule: both would delete (nobody-over ?to), which both need.
(define (domain two-arms)
  (:requirements :strips)
  (:predicates
    (robot ?a)
    (block ?b)
    (place ?p)
    (reaches ?a ?p)
    (over ?a ?p)
    (nobody-over ?p)
    (holds ?a ?b)
    (empty ?a)
    (on ?b ?p)
    (clear ?p))

  (:action swing
    :parameters (?a ?from ?to)
    :precondition (and (robot ?a) (place ?from) (place ?to) (reaches ?a ?to) (over ?a ?from) (nobody-over ?to))
    :effect (and (not (over ?a ?from)) (nobody-over ?from) (over ?a ?to) (not (nobody-over ?to))))

  (:action grasp
    :parameters (?a ?b ?p)
    :precondition (and (robot ?a) (block ?b) (place ?p) (over ?a ?p) (on ?b ?p) (empty ?a))
    :effect (and (not (on ?b ?p)) (clear ?p) (not (empty ?a)) (holds ?a ?b)))

  (:action release
    :parameters (?a ?b ?p)
    :precondition (and (robot ?a) (block ?b) (place ?p) (over ?a ?p) (holds ?a ?b) (clear ?p))
    :effect (and (not (holds ?a ?b)) (empty ?a) (on ?b ?p) (not (clear ?p))))
)
