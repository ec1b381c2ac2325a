; Written by domains/generate.py.
(define (problem corridor)
  (:domain corridor)
  (:objects
    r1 r2 - robot
    c0-0 c0-1 c0-4 c0-7 c0-8
    c1-0 c1-1 c1-2 c1-3 c1-4 c1-5 c1-6 c1-7 c1-8
    c2-0 c2-1 c2-7 c2-8 - cell
  )
  (:init
    (at r1 c1-0) (at r2 c1-8)
    (adjacent c0-0 c0-1) (adjacent c0-0 c1-0)
    (adjacent c0-1 c0-0) (adjacent c0-1 c1-1)
    (adjacent c0-4 c1-4)
    (adjacent c0-7 c0-8) (adjacent c0-7 c1-7)
    (adjacent c0-8 c0-7) (adjacent c0-8 c1-8)
    (adjacent c1-0 c0-0) (adjacent c1-0 c1-1) (adjacent c1-0 c2-0)
    (adjacent c1-1 c0-1) (adjacent c1-1 c1-0) (adjacent c1-1 c1-2) (adjacent c1-1 c2-1)
    (adjacent c1-2 c1-1) (adjacent c1-2 c1-3)
    (adjacent c1-3 c1-2) (adjacent c1-3 c1-4)
    (adjacent c1-4 c0-4) (adjacent c1-4 c1-3) (adjacent c1-4 c1-5)
    (adjacent c1-5 c1-4) (adjacent c1-5 c1-6)
    (adjacent c1-6 c1-5) (adjacent c1-6 c1-7)
    (adjacent c1-7 c0-7) (adjacent c1-7 c1-6) (adjacent c1-7 c1-8) (adjacent c1-7 c2-7)
    (adjacent c1-8 c0-8) (adjacent c1-8 c1-7) (adjacent c1-8 c2-8)
    (adjacent c2-0 c1-0) (adjacent c2-0 c2-1)
    (adjacent c2-1 c1-1) (adjacent c2-1 c2-0)
    (adjacent c2-7 c1-7) (adjacent c2-7 c2-8)
    (adjacent c2-8 c1-8) (adjacent c2-8 c2-7)
  )
  (:goal (and (at r1 c1-8) (at r2 c1-0)))
)
