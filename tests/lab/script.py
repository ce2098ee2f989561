import anytime, compiler
from my_lab import detector, f1, length, RRTStar, scenes        # a scene has .image .start .goal .truth;
                                                                 # length(path, scene) is what is really walked

@anytime.module(quality=lambda boxes, scene: f1(boxes, scene.truth))
def see(image):
    for size in 160, 320, 640:
        yield detector(image, size)                              # each answer replaces the last

@anytime.module(cost=length)                                     # quality = shortest known / this one
def find_path(boxes, start, goal):
    planner = RRTStar(boxes, start, goal, on_solution=anytime.register)
    planner.solve(until=anytime.expired)                         # the caller owns the time

@compiler.program
def navigate(image, start, goal):
    return find_path(see(image), start, goal)

library = anytime.measure(navigate, scenes(30), seconds=1.0)     # find_path on what see really delivers
schedule = compiler.compile(navigate, library)
print(schedule)                                                  # who gets how much, 20 … 1000 ms, with intervals
print(schedule.advise(seconds=0.1))                              # which module is worth speeding up
scene = scenes(31)[-1]
print(schedule.run(seconds=0.1, image=scene.image, start=scene.start, goal=scene.goal))
schedule.save("navigate.schedule")
