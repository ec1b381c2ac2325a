; To the ramp through the hall or through the yard: both robots have to push the same way.
(define (problem around)
  (:domain push-box)
  (:objects
    r1 r2 - robot
    box - box
    store hall yard ramp - room)
  (:init
    (at r1 store) (at r2 store) (stands box store)
    (door store hall) (door hall store) (door hall ramp) (door ramp hall)
    (door store yard) (door yard store) (door yard ramp) (door ramp yard))
  (:goal (stands box ramp))
)
