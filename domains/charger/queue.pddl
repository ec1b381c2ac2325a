; Both batteries are empty, both robots want to charge, and both rooms are dirty.
(define (problem queue)
  (:domain charger)
  (:objects
    r1 r2 - robot
    hall bath kitchen - room
    socket - charger)
  (:init
    (at r1 hall) (at r2 hall) (clean hall)
    (installed socket hall)
    (door hall bath) (door bath hall) (door hall kitchen) (door kitchen hall))
  (:goal (and (clean bath) (clean kitchen)))
)
