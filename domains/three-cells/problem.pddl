; Written by domains/generate.py.
(define (problem three-cells)
  (:domain three-cells)
  (:objects
    r1 r2 - robot
    a
    b c - cell
  )
  (:init
    (at r1 a) (at r2 b)
    (adjacent a b) (adjacent a c)
    (adjacent b a) (adjacent b c)
    (adjacent c a) (adjacent c b)
  )
  (:goal (and (at r1 b) (at r2 a)))
)
