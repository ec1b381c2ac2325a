; Three robots, two ends: who carries, who stays free?
(define (problem three-robots)
  (:domain tray)
  (:objects
    r1 r2 r3 - robot
    front back - end
    kitchen parlour - place)
  (:init
    (at r1 kitchen) (free r1) (at r2 kitchen) (free r2) (at r3 parlour) (free r3)
    (tray-at kitchen) (down front) (down back)
    (way kitchen parlour) (way parlour kitchen))
  (:goal (and (tray-at parlour) (down front) (down back) (not (spilled))))
)
