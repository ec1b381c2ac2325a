; Written by domains/generate.py.
(define (problem gwb2-3x3)
  (:domain grid)
  (:objects
    r1 r2 - robot
    c0-0 c0-1 c0-2
    c1-0 c1-2
    c2-0 c2-1 c2-2 - cell
  )
  (:init
    (at r1 c0-0) (at r2 c2-2)
    (adjacent c0-0 c0-1) (adjacent c0-0 c1-0)
    (adjacent c0-1 c0-0) (adjacent c0-1 c0-2)
    (adjacent c0-2 c0-1) (adjacent c0-2 c1-2)
    (adjacent c1-0 c0-0) (adjacent c1-0 c2-0)
    (adjacent c1-2 c0-2) (adjacent c1-2 c2-2)
    (adjacent c2-0 c1-0) (adjacent c2-0 c2-1)
    (adjacent c2-1 c2-0) (adjacent c2-1 c2-2)
    (adjacent c2-2 c1-2) (adjacent c2-2 c2-1)
  )
  (:goal (and (at r1 c2-2) (at r2 c0-0)))
)
