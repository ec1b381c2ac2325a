; One robot, one elevator.
(define (problem one-robot)
  (:domain elevator)
  (:objects
    r1 - walker
    lift - elevator
    ground first second - floor)
  (:init
    (stops second)
    (on r1 ground) (outside r1)
    (next ground first) (next first ground) (next first second) (next second first))
  (:goal (and (on r1 second) (outside r1)))
)
