# Base images from Debian's packages, and the system's images on top; sourced by deploy/prove.sh.

targets=(edge-server relay broker vehicle cloud tester acceptance)

# The sources of this machine's apt that are Debian's own, as one-line entries.
debian_sources() {
    apt-get indextargets --format 'deb $(REPO_URI) $(RELEASE) main' \
        'Created-By: Packages' 'Origin: Debian' 'Component: main' | sort -u
}

# A root file system with these packages, as an image.
make_root() {
    local name=$1 packages=$2
    if podman image exists "$name"; then return; fi
    debian_sources | nice -n 19 mmdebstrap --quiet --variant=essential --include="$packages" \
        --aptopt='APT::Install-Recommends "false"' \
        --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/info/*' \
        --dpkgopt='path-exclude=/usr/share/locale/*' --dpkgopt='path-exclude=/usr/share/man/*' \
        "$(. /etc/os-release && echo "$VERSION_CODENAME")" - - |
        podman import --quiet - "$name" >/dev/null
    echo "made $name of $packages"
}

images_base() {
    make_root localhost/farm/base python3,libstdc++6
    make_root localhost/farm/build python3,libstdc++6,python3-pip
}

# What this machine's pip is told that matters elsewhere too; its certificates come by a secret.
pip_configuration() {
    echo '[global]'
    python3 -m pip config list 2>/dev/null |
        sed -nE "s/^(global|:env:)\.(index-url|proxy|trusted-host)='(.*)'$/\2 = \3/p" | sort -u
    echo 'timeout = 180'
    echo 'cert = /run/secrets/ca.crt'
}

certificates() {
    local found
    found=$(python3 -m pip config list 2>/dev/null | sed -nE "s/.*\.cert='(.*)'$/\1/p" | head -n 1)
    echo "${found:-/etc/ssl/certs/ca-certificates.crt}"
}

images_build() {
    local context=$1 target
    pip_configuration >"$work/pip.conf"
    for target in "${targets[@]}"; do
        SECONDS=0
        nice -n 19 buildah bud --runtime runc --ulimit nofile=4096:4096 --ulimit nproc=4096:4096 \
            --format docker --layers --network host \
            --build-arg BASE_IMAGE=localhost/farm/base \
            --build-arg BUILD_IMAGE=localhost/farm/build \
            --secret "id=pip.conf,src=$work/pip.conf" \
            --secret "id=ca.crt,src=$(certificates)" \
            --file "$context/deploy/Dockerfile" --target "$target" \
            --tag "localhost/farm/$target" "$context" >"$work/build-$target.log" 2>&1 ||
            fail "building $target: $(tail -n 20 "$work/build-$target.log")"
        echo "built $target in $SECONDS s"
    done
}

images_list() {
    podman images --sort size --format '{{.Repository}} {{.Size}}' | grep '^localhost/farm/'
}

# Stands in for the public images of PostgreSQL and Mosquitto, which no registry gives here.
images_stand_ins() {
    make_root localhost/farm/debian-servers postgresql,mosquitto
    buildah bud --quiet --runtime runc --ulimit nofile=4096:4096 --ulimit nproc=4096:4096 \
        --format docker --layers --tag localhost/farm/servers \
        --file "$proof/servers.Dockerfile" "$proof" >/dev/null
    export POSTGRES_IMAGE=localhost/farm/servers MQTT_IMAGE=localhost/farm/servers
}
