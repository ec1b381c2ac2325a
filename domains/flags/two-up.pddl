; Two red flags are up: whatever r3 shows, the parade can start.
(define (problem two-up)
  (:domain flags)
  (:objects r1 r2 r3 - robot red green blue - colour)
  (:init (shows r1 red) (shows r2 red) (waits r3))
  (:goal (and (marched r1) (marched r2) (marched r3))))
