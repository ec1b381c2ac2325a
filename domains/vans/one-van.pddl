; Two drivers and one van: who drives it to the harbour?
(define (problem one-van)
  (:domain vans)
  (:objects
    d1 d2 - driver
    v1 - van
    depot town coast harbour - place)
  (:init
    (at d1 depot) (at d2 depot) (at v1 depot) (vacant v1)
    (road depot town) (road town depot) (road town harbour) (road harbour town)
    (road depot coast) (road coast depot) (road coast harbour) (road harbour coast)
    (path depot town) (path town depot)
    (= (total-cost) 0)
    (= (distance depot town) 2) (= (distance town depot) 2)
    (= (distance town harbour) 3) (= (distance harbour town) 3)
    (= (distance depot coast) 4) (= (distance coast depot) 4)
    (= (distance coast harbour) 4) (= (distance harbour coast) 4))
  (:goal (at v1 harbour))
  (:metric minimize (total-cost))
)
