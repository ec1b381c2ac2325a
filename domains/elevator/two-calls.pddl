; Two robots wait on different floors: which one is fetched first?
(define (problem two-calls)
  (:domain elevator)
  (:objects
    r1 r2 - walker
    lift - elevator
    ground first second - floor)
  (:init
    (stops first)
    (on r1 ground) (outside r1) (on r2 second) (outside r2)
    (next ground first) (next first ground) (next first second) (next second first))
  (:goal (and (on r1 first) (outside r1) (on r2 first) (outside r2)))
)
