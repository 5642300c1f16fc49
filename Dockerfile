# docker build -t reference-rt .
# docker run --rm -v "$PWD:/work" -v reference-rt:/cache reference-rt render scene.yaml -o scene.exr
#
# Kernels are compiled for the processor that runs them, so the image has none: the volume /cache
# keeps them.  EXTRAS= makes an image without Mitsuba.
FROM python:3.12-slim
ARG EXTRAS=compare
COPY . /source
RUN pip install --no-cache-dir "/source${EXTRAS:+[$EXTRAS]}" && rm -r /source
# Only its owner may write into the cache: what it holds is run.
RUN useradd --create-home user && install -d -o user -m 700 /cache && install -d -o user /work
USER user
ENV REFERENCE_RT_CACHE=/cache
VOLUME /cache
WORKDIR /work
ENTRYPOINT ["reference-rt"]
CMD ["--help"]
