; Written by domains/generate.py.
(define (problem gw1-2x2)
  (:domain grid-joint)
  (:objects
    c0-0 c0-1
    c1-0 c1-1 - cell
  )
  (:init
    (at r1 c0-0) (at r2 c1-1)
    (adjacent c0-0 c0-1) (adjacent c0-0 c1-0)
    (adjacent c0-1 c0-0) (adjacent c0-1 c1-1)
    (adjacent c1-0 c0-0) (adjacent c1-0 c1-1)
    (adjacent c1-1 c0-1) (adjacent c1-1 c1-0)
  )
  (:goal (and (at r1 c1-1) (at r2 c0-0)))
)
