; One parcel, two doors in the wall: the robots have to meet at the same one.
(define (problem two-doors)
  (:domain handover)
  (:objects
    r1 r2 - robot
    west west-north west-south east east-north east-south - place
    box - parcel)
  (:init
    (at r1 west) (free r1)
    (at r2 east) (free r2)
    (lies box west)
    (table west) (table east)
    (path west west-north) (path west-north west) (path west west-south) (path west-south west)
    (path east east-north) (path east-north east) (path east east-south) (path east-south east)
    (door west-north east-north) (door east-north west-north)
    (door west-south east-south) (door east-south west-south))
  (:goal (lies box east))
)
