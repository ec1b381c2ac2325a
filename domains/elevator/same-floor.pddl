; Both robots wait on one floor and go to the same one.
(define (problem same-floor)
  (:domain elevator)
  (:objects
    r1 r2 - walker
    lift - elevator
    ground first second - floor)
  (:init
    (stops first)
    (on r1 ground) (outside r1) (on r2 ground) (outside r2)
    (next ground first) (next first ground) (next first second) (next second first))
  (:goal (and (on r1 second) (outside r1) (on r2 second) (outside r2)))
)
