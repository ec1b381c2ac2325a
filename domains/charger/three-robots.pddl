; Three empty batteries, one charger: in which order?
(define (problem three-robots)
  (:domain charger)
  (:objects
    r1 r2 r3 - robot
    hall bath - room
    socket - charger)
  (:init
    (at r1 hall) (at r2 hall) (at r3 hall) (clean hall)
    (installed socket hall)
    (door hall bath) (door bath hall))
  (:goal (and (charged r1) (charged r2) (charged r3)))
)
