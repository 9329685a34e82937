"""Radiance transfer: an object's shadows and reflections worked out once.

A page then shades the object in real time under any light.
"""
