; Both robots want into the laboratory.  Who goes first, who holds the switch?
(define (problem both-in)
  (:domain lock)
  (:objects
    r1 r2 - robot
    yard lock hall lab - room
    outer inner - door)
  (:init
    (at r1 yard) (at r2 yard)
    (joins outer yard lock) (joins outer lock yard) (joins inner lock hall) (joins inner hall lock)
    (switch outer yard) (switch outer lock) (switch inner lock) (switch inner hall)
    (way hall lab) (way lab hall))
  (:goal (and (at r1 lab) (at r2 lab)))
)
