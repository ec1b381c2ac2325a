; One driver and two vans: the vans have to know which of them is driven.
(define (problem two-vans)
  (:domain vans)
  (:objects
    d1 - driver
    v1 v2 - van
    depot town harbour - place)
  (:init
    (at d1 depot) (at v1 depot) (at v2 depot) (vacant v1) (vacant v2)
    (road depot town) (road town depot) (road town harbour) (road harbour town) (road harbour depot) (road depot harbour)
    (path depot town) (path town depot)
    (= (total-cost) 0)
    (= (distance depot town) 2) (= (distance town depot) 2) (= (distance town harbour) 3) (= (distance harbour town) 3)
    (= (distance depot harbour) 4) (= (distance harbour depot) 4))
  (:goal (at d1 harbour))
  (:metric minimize (total-cost))
)
