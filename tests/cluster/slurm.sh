#!/usr/bin/env bash
# A SLURM of one node on this machine, for tests: munged, slurmctld and slurmd of the packages slurm-wlm and munge.
#
#   slurm.sh start DIR      in a folder of its own, on ports of its own, with a key of its own: nothing of a SLURM that
#                           this machine belongs to is read or touched; then: export SLURM_CONF=DIR/slurm.conf
#   slurm.sh restart DIR    slurmctld is killed (-9) and started anew from its saved state
#   slurm.sh stop DIR       ends the jobs and the three daemons
set -euo pipefail

command=${1:?start, restart or stop}
dir=${2:?a folder}
mkdir -p "$dir"
dir=$(cd "$dir" && pwd)
export SLURM_CONF=$dir/slurm.conf PATH=$PATH:/usr/sbin:/sbin
host=$(hostname -s)

running() { [ -s "$dir/$1.pid" ] && kill -0 "$(cat "$dir/$1.pid")" 2>/dev/null; }

configure() {
    mkdir -p "$dir/state" "$dir/spool"
    [ -s "$dir/munge.key" ] || (umask 077 && head -c 1024 /dev/urandom >"$dir/munge.key")
    cat >"$SLURM_CONF" <<CONF
ClusterName=gpsim-test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=${GPSIM_SLURM_PORT:-26817}
SlurmdPort=$((${GPSIM_SLURM_PORT:-26817} + 1))
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/munge
AuthInfo=socket=$dir/munge.socket
CredType=cred/munge
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd.log
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=sched_interval=2
InactiveLimit=0
KillWait=5
MpiDefault=none
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=8 RealMemory=64000 State=UNKNOWN
PartitionName=test Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
}

start_munge() {
    running munged && return
    rm -f "$dir/munge.socket" "$dir/munge.socket.lock"
    munged --force --key-file="$dir/munge.key" --socket="$dir/munge.socket" --pid-file="$dir/munged.pid" \
        --log-file="$dir/munged.log" --seed-file="$dir/munge.seed" --num-threads=2
}

wait_for_node() {
    for _ in $(seq 60); do
        if sinfo --noheader --format=%t 2>/dev/null | grep -qE '^(idle|mix|alloc)'; then return; fi
        sleep 0.5
    done
    echo "slurm.sh: SLURM did not come up; see $dir/*.log" >&2
    exit 1
}

case $command in
    start)
        for needed in munged slurmctld slurmd; do
            command -v $needed >/dev/null || { echo "slurm.sh: no $needed; apt-get install slurm-wlm munge" >&2; exit 3; }
        done
        configure
        start_munge
        running slurmctld || slurmctld
        running slurmd || slurmd
        wait_for_node
        ;;
    restart)
        running slurmctld && kill -9 "$(cat "$dir/slurmctld.pid")"
        sleep "${3:-3}"
        rm -f "$dir/slurmctld.pid"
        slurmctld
        wait_for_node
        ;;
    stop)
        running slurmctld && scancel --me 2>/dev/null || true
        sleep 1
        for daemon in slurmd slurmctld munged; do
            if running $daemon; then kill "$(cat "$dir/$daemon.pid")" || true; fi
        done
        ;;
    *)
        echo "slurm.sh: start, restart or stop" >&2
        exit 2
        ;;
esac
