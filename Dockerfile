# docker build -t tdac .
# docker run --rm -v "$PWD:/work" tdac synth --out runs/maze-1
FROM python:3.12-slim

RUN apt-get update \
    && apt-get install -y --no-install-recommends bubblewrap \
    && rm -rf /var/lib/apt/lists/*
COPY . /src
RUN sh /src/tools/install_in_container.sh /src /opt/tdac && rm -rf /src

RUN useradd --create-home tdac && mkdir /work && chown tdac /work
USER tdac
WORKDIR /work
ENV PATH=/opt/tdac/bin:$PATH
ENTRYPOINT ["tdac"]
CMD ["--help"]
