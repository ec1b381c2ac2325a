; Written by domains/generate.py.
(define (problem gwb4-2x5)
  (:domain grid-joint)
  (:objects
    c0-0 c0-1 c0-2 c0-3 c0-4
    c1-0 c1-1 c1-2 c1-3 c1-4 - cell
  )
  (:init
    (at r1 c0-0) (at r2 c1-4)
    (adjacent c0-0 c0-1) (adjacent c0-0 c1-0)
    (adjacent c0-1 c0-0) (adjacent c0-1 c0-2)
    (adjacent c0-2 c0-1) (adjacent c0-2 c0-3)
    (adjacent c0-3 c0-2) (adjacent c0-3 c0-4)
    (adjacent c0-4 c0-3) (adjacent c0-4 c1-4)
    (adjacent c1-0 c0-0) (adjacent c1-0 c1-1)
    (adjacent c1-1 c1-0) (adjacent c1-1 c1-2)
    (adjacent c1-2 c1-1) (adjacent c1-2 c1-3)
    (adjacent c1-3 c1-2) (adjacent c1-3 c1-4)
    (adjacent c1-4 c0-4) (adjacent c1-4 c1-3)
  )
  (:goal (and (at r1 c1-4) (at r2 c0-0)))
)
