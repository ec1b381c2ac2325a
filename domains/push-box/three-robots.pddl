; Three robots and the same box: two have to push, and the goal does not say which two.
(define (problem three-robots)
  (:domain push-box)
  (:objects
    r1 r2 r3 - robot
    box - box
    store hall yard ramp - room)
  (:init
    (at r1 store) (at r2 hall) (at r3 yard) (stands box store)
    (door store hall) (door hall store) (door hall ramp) (door ramp hall)
    (door store yard) (door yard store) (door yard ramp) (door ramp yard))
  (:goal (stands box ramp))
)
