//! A machine on the first adapter that will do, and how to get numbers back from it.

use gdt_batch::gpu::buffers::{Name, Set};
use gdt_batch::gpu::device::{self, Device, Wish};
use gdt_batch::gpu::machine::Machine;
use gdt_batch::gpu::steps::Recording;

pub(crate) struct Rig {
    pub(crate) machine: Machine,
    set: Set,
}

impl Rig {
    /// `None`, said plainly, on a machine without any adapter.
    pub(crate) fn new() -> Option<Rig> {
        let adapters = device::adapters();
        let infos: Vec<_> = adapters.iter().map(|adapter| adapter.get_info()).collect();
        match device::choose(&infos, &Wish::new(None, true)) {
            Ok(i) => {
                let device = Device::open(&adapters[i]).expect("the adapter opens");
                Some(Rig { machine: Machine::new(device), set: Set::default() })
            }
            Err(why) => {
                eprintln!("SKIPPED: {why}; install mesa-vulkan-drivers to test the shaders");
                None
            }
        }
    }

    pub(crate) fn run(&mut self, recording: &Recording) {
        self.machine.start(&mut self.set, recording).expect("the steps run");
    }

    /// `count` numbers of buffer `name`.
    pub(crate) fn fetch(&mut self, name: Name, count: u64) -> Vec<u32> {
        if count == 0 {
            return Vec::new();
        }
        let ticket = self.machine.fetch(&mut self.set, name, 0, 4 * count).expect("the copy starts");
        self.machine.finish(&self.set, ticket).expect("the copy ends")
    }
}
