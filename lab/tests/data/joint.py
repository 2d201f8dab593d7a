"""Makes joint.csv: an instrument's wrist whose cable has free play, and nothing else that a model would miss.

The play is not a clamp, as in krait, but a driven part that a stiff spring pushes as soon as the drive touches it, integrated
in 200 substeps a row: pushed (drive beyond the gap) it relaxes towards contact within 0.5 ms, else friction holds it. The
sensor has 0.05 deg of white noise and is read with a resolution of 0.01 deg. Same seed, same file.
"""
import math, random

RATE_HZ, SECONDS, HALF_GAP_DEG, CONTACT_S, SUBSTEPS = 50, 80, 0.8, 0.0005, 200
random.seed(20060517)

def targets():
    while True:
        yield random.uniform(-40, 40), random.uniform(8, 40), random.choice([0, 0, 0.5, 2.0])

def path():
    """Positions at RATE_HZ: cosine ramps between random targets, some with a rest behind."""
    at, out = 0.0, []
    for goal, speed, rest_s in targets():
        n = max(2, int(abs(goal - at) / speed * RATE_HZ))
        out += [at + (goal - at) * 0.5 * (1 - math.cos(math.pi * (k + 1) / n)) for k in range(n)]
        out += [goal] * int(rest_s * RATE_HZ)
        at = goal
        if len(out) >= RATE_HZ * SECONDS:
            return [0.0] + out[: RATE_HZ * SECONDS - 1]

driven, last = 0.0, 0.0
print("time_s,u1_deg,y1_deg")
for row, u in enumerate(path()):
    for k in range(SUBSTEPS):
        drive = last + (u - last) * (k + 1) / SUBSTEPS
        gap = drive - driven
        push = gap - math.copysign(min(abs(gap), HALF_GAP_DEG), gap)
        driven += push * (1 - math.exp(-1 / (RATE_HZ * SUBSTEPS * CONTACT_S)))
    last = u
    measured = round((driven + random.gauss(0, 0.05)) / 0.01) * 0.01
    print(f"{row / RATE_HZ:.2f},{u:.4f},{measured:.2f}")
