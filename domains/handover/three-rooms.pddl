; Three robots in three rooms: two doors between the first two rooms, one door between the last two.
(define (problem three-rooms)
  (:domain handover)
  (:objects
    r1 r2 r3 - robot
    west west-north west-south middle-north middle-south middle-east east - place
    box - parcel)
  (:init
    (at r1 west) (free r1)
    (at r2 middle-east) (free r2)
    (at r3 east) (free r3)
    (lies box west)
    (table west) (table east)
    (path west west-north) (path west-north west) (path west west-south) (path west-south west)
    (path middle-east middle-north) (path middle-north middle-east)
    (path middle-east middle-south) (path middle-south middle-east)
    (door west-north middle-north) (door middle-north west-north)
    (door west-south middle-south) (door middle-south west-south)
    (door middle-east east) (door east middle-east))
  (:goal (lies box east))
)
