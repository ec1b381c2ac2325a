; Three robots: whoever does not pass may hold the switch, and the state does not show who does.
(define (problem three-robots)
  (:domain lock)
  (:objects
    r1 r2 r3 - robot
    yard lock hall lab - room
    outer inner - door)
  (:init
    (at r1 lock) (at r2 hall) (at r3 hall)
    (joins outer yard lock) (joins outer lock yard) (joins inner lock hall) (joins inner hall lock)
    (switch outer yard) (switch outer lock) (switch inner lock) (switch inner hall)
    (way hall lab) (way lab hall))
  (:goal (at r1 lab))
)
