; The same with one door: there is nothing to agree on.
(define (problem one-door)
  (:domain handover)
  (:objects
    r1 r2 - robot
    west west-north east east-north - place
    box - parcel)
  (:init
    (at r1 west) (free r1)
    (at r2 east) (free r2)
    (lies box west)
    (table west) (table east)
    (path west west-north) (path west-north west)
    (path east east-north) (path east-north east)
    (door west-north east-north) (door east-north west-north))
  (:goal (lies box east))
)
