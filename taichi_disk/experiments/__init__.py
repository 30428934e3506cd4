"""From a scene file to a number: keys, kinds of scenes, the loop over time, the choice
of the step, error estimates. It knows no folder and no picture."""
