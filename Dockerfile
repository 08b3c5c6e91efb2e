# dreamsearch in a container: docker build -t dreamsearch . && docker run -v "$PWD:/work" dreamsearch list
# The package is made in one image and installed, with what draws curves and films, in another.
FROM debian:12 AS build
COPY . /source
RUN cd /source && apt-get update && experiments/install_packages.sh && \
    cmake --preset release -DDREAMSEARCH_TESTS=OFF && cmake --build --preset release && \
    cpack --config build/release/CPackConfig.cmake -G DEB -B /package
FROM debian:12-slim
COPY --from=build /package/*.deb /tmp/
RUN apt-get update && apt-get install -y /tmp/*.deb && rm -rf /tmp/*.deb /var/lib/apt/lists/*
WORKDIR /work
ENTRYPOINT ["runner"]
