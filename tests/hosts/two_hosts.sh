#!/bin/sh
# A run over two hosts on one machine, as root:
#
#   tests/hosts/two_hosts.sh SWERVE TUNNEL OUT [ARGUMENTS OF swerve run]
#
# SWERVE is this project's program, TUNNEL iceoryx2's (iox2-link-tunnel-zenoh), OUT a folder for all that is written.
# A host here is a network namespace with shared memory of its own; a virtual cable is between them. A tunnel runs on
# each. The coordinator is on host a; it starts its worker on host b.
set -eu
swerve=$(realpath "$1") tunnel=$(realpath "$2")
mkdir -p "$3/config"
out=$(realpath "$3")
shift 3
repository=$(realpath "$(dirname "$0")/../..")
a=swerve_a_$$ b=swerve_b_$$
unset XDG_RUNTIME_DIR # files are in the same place on any machine then
files=${TMPDIR:-/tmp}/swerve_ipc_$(id -u)

end() {
  for host in $a $b; do
    ip netns pids $host | xargs -r kill 2>/dev/null || true
    ip netns del $host || true
  done
}
trap end EXIT
trap 'exit 1' INT TERM

mkdir -p -m 700 "$files"
ip netns add $a
ip netns add $b
ip link add va$$ netns $a type veth peer name vb$$ netns $b
ip -n $a addr add 10.79.0.1/24 dev va$$
ip -n $b addr add 10.79.0.2/24 dev vb$$
for link in "$a va$$" "$b vb$$"; do
  ip -n "${link% *}" link set lo up
  ip -n "${link% *}" link set "${link#* }" up
done

# Shared memory, and the folder of iceoryx2's files, of its own: as long as the sleeper sleeps.
host() {
  ip netns exec "$1" unshare --mount sh -c '
    mount -t tmpfs tmpfs /dev/shm && mount -t tmpfs tmpfs "$0" && echo $$ >"$1" && exec sleep 600' "$files" "$out/$2.pid" &
  while ! [ -s "$out/$2.pid" ]; do sleep 0.05; done
}
rm -f "$out/a.pid" "$out/b.pid"
host $a a
host $b b
on() {
  place=$1
  shift
  nsenter --target "$(cat "$out/$place.pid")" --net --mount --wd="$out" "$@"
}

# The tunnel joins the shared memory that configs/two_hosts.toml names.
cat >"$out/config/iceoryx2.toml" <<END
[global]
root-path = "$files/two_hosts"
prefix = "swerve_two_hosts_"
[defaults.publish-subscribe]
max-subscribers = 16
max-publishers = 2
max-nodes = 20
subscriber-max-buffer-size = 64
subscriber-max-borrowed-samples = 64
enable-safe-overflow = true
END
# By address: multicast takes a while to work on a cable that is new.
quiet='scouting: { multicast: { enabled: false } }'
echo "{ listen: { endpoints: ['tcp/10.79.0.1:7447'] }, $quiet }" >"$out/a.json5"
echo "{ connect: { endpoints: ['tcp/10.79.0.1:7447'] }, $quiet }" >"$out/b.json5"
for place in a b; do
  on $place "$tunnel" --zenoh-config $place.json5 --reactive --poll 1 >"$out/tunnel_$place.log" 2>&1 &
done

far="nsenter --target $(cat "$out/b.pid") --net --mount $swerve worker"
start=$(printf '"%s", ' $far)
on a "$swerve" run "$repository/scenarios/person_behind_truck.toml" -c "$repository/configs/two_hosts.toml" \
  --set "process.far.start=[$start]" --out "$out/run" "$@"
