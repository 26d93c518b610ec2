# Podman and Buildah in a folder of their own, for deploy/prove.sh; sourced.
#
# docker-compose talks to `podman system service`, which serves one socket in that folder for as
# long as the proof runs.

declare -A tool_of=(
    [buildah]=buildah [podman]=podman [runc]=runc [mmdebstrap]=mmdebstrap
    [docker-compose]=docker-compose [iptables]=iptables [curl]=curl
    [/usr/lib/podman/netavark]=netavark [/usr/lib/podman/aardvark-dns]=aardvark-dns
    [/usr/bin/catatonit]=catatonit [openssl]=openssl [pgrep]=procps
)
project=farm-proof
compose_files=(--file "$root/deploy/compose.yaml")
service_pid=

engine_install() {
    local missing=() tool
    for tool in "${!tool_of[@]}"; do
        command -v "$tool" >/dev/null || missing+=("${tool_of[$tool]}")
    done
    if ((${#missing[@]})); then
        apt-get update --quiet=2
        DEBIAN_FRONTEND=noninteractive apt-get install --quiet=2 --yes --no-install-recommends \
            "${missing[@]}"
    fi
    buildah --version
    podman --version
    docker-compose --version
}

# Limits that podman sets by itself may be above what a sandboxed root may set.
engine_start() {
    cat >"$work/storage.conf" <<CONF
[storage]
driver = "${STORAGE_DRIVER:-overlay}"
graphroot = "$work/storage"
runroot = "$work/run"
CONF
    cat >"$work/containers.conf" <<CONF
[containers]
default_ulimits = ["nofile=4096:4096", "nproc=4096:4096"]
[engine]
runtime = "runc"
events_logger = "file"
tmp_dir = "$work/tmp"
[network]
network_backend = "netavark"
network_config_dir = "$work/networks"
CONF
    mkdir -p "$work/networks"
    export CONTAINERS_STORAGE_CONF=$work/storage.conf CONTAINERS_CONF=$work/containers.conf
    podman --log-level fatal system service --time 0 "unix://$work/podman.sock" \
        >"$work/service.log" 2>&1 {lock}>&- &
    service_pid=$!
    export DOCKER_HOST=unix://$work/podman.sock
    export SECRETS_DIR=$work/secrets IMAGE_PREFIX=localhost/farm
    until [[ -S $work/podman.sock ]]; do
        kill -0 "$service_pid" || fail "$(cat "$work/service.log")"
        sleep 0.1
    done
}

engine_stop() {
    local code=$?
    if [[ -n $service_pid ]]; then
        ((code == 0)) || show_logs
        system_down >/dev/null 2>&1 || true
        kill "$service_pid"
        wait "$service_pid" 2>/dev/null || true
    fi
    # Monitors of finished commands stay for minutes, and would write into the folder once more.
    pgrep --full "^/usr/bin/conmon .*$work/" | xargs --no-run-if-empty kill || true
    if [[ -z ${KEEP:-} && -z ${PROOF_DIR:-} ]]; then
        buildah rm --all >/dev/null 2>&1 || true
        # A container that has just ended may still hold it; what nobody holds any more then goes.
        umount "$work/storage/overlay" 2>/dev/null ||
            umount --lazy "$work/storage/overlay" 2>/dev/null || true
        rm -rf "$work" || printf 'left behind: %s\n' "$work" >&2
    fi
    exit "$code"
}

compose() {
    docker-compose --project-name "$project" "${compose_files[@]}" "$@"
}

# Names of this project's containers that run.
containers() {
    podman ps --format '{{.Names}}' --filter "name=^${project}_"
}

show_logs() {
    local name
    for name in $(containers); do
        printf -- '-- %s\n' "$name" >&2
        podman logs --tail 10 "$name" >&2 || true
    done
}
