# smad from its checkout, with what README's two commands need.
#   docker build -t smad . && docker run --rm -it smad make demo
# Debian 12 is what the tests run on; its buildah builds this, too: buildah bud -t smad .
FROM debian:bookworm-slim

RUN apt-get update \
    && apt-get install -y --no-install-recommends \
        ca-certificates git make python3 python3-venv \
        gcc libc6-dev gcc-avr binutils-avr avr-libc libsimavr-dev libelf-dev \
        gcc-arm-none-eabi qemu-system-arm chromium chromium-driver libtbb12 nginx \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /smad
# What is installed first changes seldom: an edit of the code keeps this layer.
COPY pyproject.toml uv.lock README.md Makefile ./
COPY tools tools
COPY docs docs
COPY smad smad
COPY sim_device sim_device
COPY firmware_protocol firmware_protocol
RUN make setup .venv/.test-packages
COPY . .
RUN make setup-test
CMD ["make", "demo"]
