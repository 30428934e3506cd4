"""One impact: choose parameters, run it, and print the results.

python docs/examples/one_impact.py
"""

from taichi_disk import load_scene, run

# A shipped scene with some keys changed; `taichi-disk check exponential_wall` lists all
# keys.
scene = load_scene("exponential_wall").with_(
    points=300, viscosity=0.0091, velocity=0.03
)
result = run(scene)

e = result.summary["lattices"]["restitution"]  # over eight random lattices
low, high = e["interval_95"]
print(f"restitution  {e['mean']:.4f}, 95 % interval {low:.4f} to {high:.4f}")
print(f"contact time {result.contact_time:.3f} R/c")

series = result.series  # the columns of timeseries.csv
peak = series["wall_force"].argmax()
print(
    f"largest force of the wall {series['wall_force'][peak]:.4g} M c^2/R at t ="
    f" {series['t'][peak]:.3f} R/c"
)
loss = series["dissipated"][-1] / series["kinetic"][0]
print(f"the dashpots took {loss:.1%} of the kinetic energy")
