; Into the hall: there is one way only, and one robot has to come first.
(define (problem next-door)
  (:domain push-box)
  (:objects
    r1 r2 - robot
    box - box
    store hall yard ramp - room)
  (:init
    (at r1 store) (at r2 ramp) (stands box store)
    (door store hall) (door hall store) (door hall ramp) (door ramp hall)
    (door store yard) (door yard store) (door yard ramp) (door ramp yard))
  (:goal (stands box hall))
)
