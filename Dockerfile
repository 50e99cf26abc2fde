# For systems that PyBullet has no wheels for; see docs/howto/container.md.
FROM python:3.11-slim-bookworm

RUN useradd --create-home --uid 1000 vrs && mkdir /data && chown vrs:vrs /data
WORKDIR /opt/vrs-teleop
COPY pyproject.toml constraints.txt hashes.txt README.md LICENSE LICENSE-APACHE-2.0 THIRD_PARTY.md ./
COPY vrs vrs
COPY robots robots
COPY interfaces interfaces
COPY .ci/install.py .ci/
# docker build --build-arg EXTRAS="cluster parquet": for sweeps on many machines, docs/howto/cluster.md.
ARG EXTRAS=""
RUN PIP_NO_CACHE_DIR=1 python .ci/install.py . $EXTRAS

COPY examples /data/examples
USER vrs
WORKDIR /data
VOLUME /data
EXPOSE 8600
ENV PYTHONUNBUFFERED=1
CMD ["vrs", "serve", "--host", "0.0.0.0", "--port", "8600", "--token-file", "/data/tokens", "--link-loss", "hold"]
