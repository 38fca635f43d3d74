"""The stages in NumPy: one module per WGSL file, same stem, same functions, same arithmetic.

Where WGSL works on a vec4 of neighbouring pixels, the twin works on an array of pixels of any
shape; ``select(f, t, c)`` there is ``np.where(c, t, f)`` here.  Everything is float32 or integer
and follows the order of operations of the WGSL, so that a device which does not contract a*b+c
gives the same bits.

What files choose by marks, a function of the twin chooses by its argument ``facts``
(``contract.stages.FACTS``), and what files choose by standing for one another it is given as
``chosen`` or ``keys``.
"""
