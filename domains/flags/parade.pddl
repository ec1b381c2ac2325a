; Any two plans of this task mix freely, if each robot follows one of the two; some three plans do not.
(define (problem parade)
  (:domain flags)
  (:objects r1 r2 r3 - robot red green blue - colour)
  (:init (waits r1) (waits r2) (waits r3))
  (:goal (and (marched r1) (marched r2) (marched r3))))
