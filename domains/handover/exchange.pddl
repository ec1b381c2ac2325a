; One door, two parcels that change sides: each robot has one hand, so one parcel goes first.
(define (problem exchange)
  (:domain handover)
  (:objects
    r1 r2 - robot
    west west-north east east-north - place
    box can - parcel)
  (:init
    (at r1 west) (free r1)
    (at r2 east) (free r2)
    (lies box west) (lies can east)
    (table west) (table east)
    (path west west-north) (path west-north west)
    (path east east-north) (path east-north east)
    (door west-north east-north) (door east-north west-north))
  (:goal (and (lies box east) (lies can west)))
)
