//! Tests of the loop, its safety chain, devices and files. Tests of threads in real time are binaries of their own.

#[path = "shared/bridge.rs"]
mod ends;
#[path = "shared/wait.rs"]
mod wait;

mod black_box;
mod bridge;
mod bridge_packets;
mod bridge_page;
mod bridge_peer;
mod devices;
mod exchange;
mod faults;
mod random_faults;
mod recordings;
mod ticks;
mod trajectories;
