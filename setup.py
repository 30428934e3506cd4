"""Begin each build in an empty folder: setuptools would pack what an earlier version of
this clone has left there."""

from shutil import rmtree

from setuptools import setup

rmtree("build/lib", ignore_errors=True)
setup()
