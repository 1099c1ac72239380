#!/bin/sh
# A Slurm of one node on this machine, to try things with; it needs no root and no munge.
#
#   one-node.sh start DIR     starts it; then: export SLURM_CONF=DIR/slurm.conf
#   one-node.sh stop DIR
#
# Debian: apt-get install --no-install-recommends slurm-wlm
set -eu
PATH=$PATH:/usr/sbin:/sbin
dir=$(cd "$2" && pwd)

stop() {
    for name in slurmd slurmctld; do
        [ -f "$dir/$name.pid" ] && kill "$(cat "$dir/$name.pid")" 2>/dev/null || true
    done
}

start() {
    host=$(hostname -s)
    user=$(id -un)
    # Two free ports of this machine.
    port=$((20000 + $$ % 20000))
    mkdir -p "$dir/state" "$dir/spool"
    cat >"$dir/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmdPort=$((port + 1))
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/none
CredType=cred/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=2,batch_sched_delay=0,sched_min_interval=100000
MinJobAge=300
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd.log
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
NodeName=node0 NodeAddr=127.0.0.1 NodeHostname=$host CPUs=8 State=UNKNOWN
PartitionName=all Nodes=node0 Default=YES MaxTime=INFINITE State=UP
CONF
    export SLURM_CONF="$dir/slurm.conf"
    slurmctld
    slurmd -N node0
    for _ in $(seq 300); do
        [ "$(sinfo --noheader --format=%T 2>/dev/null)" = idle ] && exit 0
        sleep 0.1
    done
    echo "no node became idle: see $dir/slurmctld.log and $dir/slurmd.log" >&2
    exit 1
}

"$1"
