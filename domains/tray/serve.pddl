; Carry the tray into the parlour.  Who takes which end?
(define (problem serve)
  (:domain tray)
  (:objects
    r1 r2 - robot
    front back - end
    kitchen parlour - place)
  (:init
    (at r1 kitchen) (free r1) (at r2 kitchen) (free r2)
    (tray-at kitchen) (down front) (down back)
    (way kitchen parlour) (way parlour kitchen))
  (:goal (and (tray-at parlour) (down front) (down back) (not (spilled))))
)
