"""F10: furnaces: where everything shines equally, every radiance is known.

Law.
- closed: in a room whose walls emit 1 and reflect a, 1 / (1 - a) arrives from everywhere: the mean
  of 1024 pixels, to its noise (see `harness.chance`) and to a tenth.  Both trace with Russian
  roulette from the fifth edge on.  Ours goes on with a chance of up to 0.999, Mitsuba of up to
  0.95: beyond an albedo of 0.975 the variance of its weights is infinite.
- open: a surface under a white sky sends back, in power, no more than arrives: the mean of weights
  of samples is at most 1, to its noise, and is the integral of evaluate() over a chart of half
  vectors, which no sample has a part in.
  Principled materials with a diffuse part are not among these: by their law (docs/scenes.md) a
  white base returns up to 1.6 times the light; metals and glass of it are.
- lossless: n spheres of glass within each other are invisible under a white sky: every pixel is 1,
  not only in the mean, to 64 u for each edge of the mean path, 4 n; a path through all of them is
  2 n edges long, and mirrored ones are longer.

Range.  a from 0 to 0.999;  alpha 1e-4 to 1;  n to 100.  u = 2^-53; Mitsuba's is 2^-24.

Counts.  A picture a point; 200,000 samples of each white material at four cosines; 4,096 pixels.

Passes.  No failure; each statistical case has a false alarm of at most 1e-8.
"""
