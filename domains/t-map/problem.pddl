; Written by domains/generate.py.
(define (problem t-map)
  (:domain t-map)
  (:objects
    r1 r2 - robot
    c0-1
    c1-0 c1-1 c1-2 - cell
  )
  (:init
    (at r1 c0-1) (at r2 c1-0)
    (adjacent c0-1 c1-1)
    (adjacent c1-0 c1-1)
    (adjacent c1-1 c0-1) (adjacent c1-1 c1-0) (adjacent c1-1 c1-2)
    (adjacent c1-2 c1-1)
  )
  (:goal (and (at r1 c1-0) (at r2 c0-1)))
)
