; Both batteries are empty, but one robot is still on its way to the charger when the other one is done.
(define (problem in-turn)
  (:domain charger)
  (:objects
    r1 r2 - robot
    hall bath kitchen - room
    socket - charger)
  (:init
    (at r1 hall) (at r2 bath) (clean hall)
    (installed socket hall)
    (door hall bath) (door bath hall) (door hall kitchen) (door kitchen hall))
  (:goal (and (charged r1) (charged r2)))
)
