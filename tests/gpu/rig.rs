//! A machine on the first adapter that will do, and how to get numbers back from it.

use gdt_batch::gpu::Fault;
use gdt_batch::gpu::buffers::{Name, Set};
use gdt_batch::gpu::device::{self, Device, Wish};
use gdt_batch::gpu::machine::Machine;
use gdt_batch::gpu::selftest::{Comparison, compare};
use gdt_batch::gpu::steps::{Recording, Size};

pub(crate) struct Rig {
    machine: Machine,
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
                assert!(std::env::var_os("GDT_TEST_ALL").is_none(), "{why}");
                eprintln!("skipped: {why}; Debian's mesa-vulkan-drivers brings a software GPU that will do");
                None
            }
        }
    }

    /// The pixels of the largest texture.
    pub(crate) fn most_pixels(&self) -> u64 {
        device::most_pixels(&self.machine.device().limits)
    }

    /// Every step against its twin.
    pub(crate) fn compare(&mut self, size: Size, pixels: &[u32]) -> Vec<Comparison> {
        compare(&mut self.machine, &mut self.set, size, pixels).expect("the steps run")
    }

    /// Loses the device, as a driver's reset would.
    pub(crate) fn lose(&self) {
        self.machine.device().device.destroy();
    }

    pub(crate) fn try_run(&mut self, recording: &Recording) -> Result<(), Fault> {
        let submission = self.machine.start(&mut self.set, recording)?;
        self.machine.device().wait(submission)
    }

    pub(crate) fn run(&mut self, recording: &Recording) {
        self.machine.start(&mut self.set, recording).expect("the steps run");
    }

    /// The first `count` numbers of buffer `name`.
    pub(crate) fn numbers(&mut self, name: Name, count: u64) -> Vec<u32> {
        self.machine.numbers(&mut self.set, name, count).expect("they come back")
    }
}
