; One driver, one van: each has one thing to do.
(define (problem alone)
  (:domain vans)
  (:objects
    d1 - driver
    v1 - van
    depot town harbour - place)
  (:init
    (at d1 town) (at v1 depot) (vacant v1)
    (road depot town) (road town depot) (road town harbour) (road harbour town) (road harbour depot) (road depot harbour)
    (path depot town) (path town depot)
    (= (total-cost) 0)
    (= (distance depot town) 2) (= (distance town depot) 2) (= (distance town harbour) 3) (= (distance harbour town) 3)
    (= (distance depot harbour) 4) (= (distance harbour depot) 4))
  (:goal (and (at v1 harbour) (at d1 harbour)))
  (:metric minimize (total-cost))
)
