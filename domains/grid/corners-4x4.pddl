; Written by domains/generate.py.
(define (problem corners-4x4)
  (:domain grid)
  (:objects
    r1 r2 - robot
    c0-0 c0-1 c0-2 c0-3
    c1-0 c1-1 c1-2 c1-3
    c2-0 c2-1 c2-2 c2-3
    c3-0 c3-1 c3-2 c3-3 - cell
  )
  (:init
    (at r1 c0-0) (at r2 c3-3)
    (adjacent c0-0 c0-1) (adjacent c0-0 c1-0)
    (adjacent c0-1 c0-0) (adjacent c0-1 c0-2) (adjacent c0-1 c1-1)
    (adjacent c0-2 c0-1) (adjacent c0-2 c0-3) (adjacent c0-2 c1-2)
    (adjacent c0-3 c0-2) (adjacent c0-3 c1-3)
    (adjacent c1-0 c0-0) (adjacent c1-0 c1-1) (adjacent c1-0 c2-0)
    (adjacent c1-1 c0-1) (adjacent c1-1 c1-0) (adjacent c1-1 c1-2) (adjacent c1-1 c2-1)
    (adjacent c1-2 c0-2) (adjacent c1-2 c1-1) (adjacent c1-2 c1-3) (adjacent c1-2 c2-2)
    (adjacent c1-3 c0-3) (adjacent c1-3 c1-2) (adjacent c1-3 c2-3)
    (adjacent c2-0 c1-0) (adjacent c2-0 c2-1) (adjacent c2-0 c3-0)
    (adjacent c2-1 c1-1) (adjacent c2-1 c2-0) (adjacent c2-1 c2-2) (adjacent c2-1 c3-1)
    (adjacent c2-2 c1-2) (adjacent c2-2 c2-1) (adjacent c2-2 c2-3) (adjacent c2-2 c3-2)
    (adjacent c2-3 c1-3) (adjacent c2-3 c2-2) (adjacent c2-3 c3-3)
    (adjacent c3-0 c2-0) (adjacent c3-0 c3-1)
    (adjacent c3-1 c2-1) (adjacent c3-1 c3-0) (adjacent c3-1 c3-2)
    (adjacent c3-2 c2-2) (adjacent c3-2 c3-1) (adjacent c3-2 c3-3)
    (adjacent c3-3 c2-3) (adjacent c3-3 c3-2)
  )
  (:goal (and (at r1 c3-3) (at r2 c0-0)))
)
