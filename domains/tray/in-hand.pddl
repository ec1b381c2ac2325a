; The tray is in their hands already: one thing to do in each step.
(define (problem in-hand)
  (:domain tray)
  (:objects
    r1 r2 - robot
    front back - end
    kitchen parlour - place)
  (:init
    (at r1 kitchen) (holds r1 front) (at r2 kitchen) (holds r2 back)
    (tray-at kitchen)
    (way kitchen parlour) (way parlour kitchen))
  (:goal (and (tray-at parlour) (down front) (down back) (not (spilled))))
)
