; One is in the lock already and knows what to do.
(define (problem let-in)
  (:domain lock)
  (:objects
    r1 r2 - robot
    yard lock hall lab - room
    outer inner - door)
  (:init
    (at r1 lock) (at r2 hall)
    (joins outer yard lock) (joins outer lock yard) (joins inner lock hall) (joins inner hall lock)
    (switch outer yard) (switch outer lock) (switch inner lock) (switch inner hall)
    (way hall lab) (way lab hall))
  (:goal (and (at r1 lab) (at r2 lab)))
)
