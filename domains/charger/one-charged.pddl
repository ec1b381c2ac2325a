; One robot is charged and in its room.  Only the other one needs the charger.
(define (problem one-charged)
  (:domain charger)
  (:objects
    r1 r2 - robot
    hall bath kitchen - room
    socket - charger)
  (:init
    (at r1 bath) (charged r1) (at r2 hall) (clean hall)
    (installed socket hall)
    (door hall bath) (door bath hall) (door hall kitchen) (door kitchen hall))
  (:goal (and (clean bath) (clean kitchen)))
)
