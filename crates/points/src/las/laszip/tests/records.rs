//! Records to encode.

/// A generator of numbers (xorshift64*), the same on every machine.
pub(super) struct Random(pub(super) u64);

impl Random {
    /// Returns a number less than `end`.
    pub(super) fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 32) % end
    }

    /// Returns a step that is usually small.
    pub(super) fn step(&mut self) -> i64 {
        let bits = self.below(10) * self.below(4);
        self.below(1 << (bits + 1)) as i64 - (1 << bits)
    }
}

/// The fields of a point format that begin behind the first ones.
struct Places {
    length: usize,
    time: Option<usize>,
    rgb: Option<usize>,
    wave_packet: Option<usize>,
}

impl Places {
    fn of(format: u8) -> Places {
        let (length, time, rgb, wave_packet) = match format {
            0 => (20, None, None, None),
            1 => (28, Some(20), None, None),
            2 => (26, None, Some(20), None),
            3 => (34, Some(20), Some(28), None),
            4 => (57, Some(20), None, Some(28)),
            5 => (63, Some(20), Some(28), Some(34)),
            6 => (30, Some(22), None, None),
            7 => (36, Some(22), Some(30), None),
            _ => (38, Some(22), Some(30), None),
        };
        Places { length, time, rgb, wave_packet }
    }
}

/// Returns records that change as those of a scanner do, with leaps in between.
pub(super) fn records(format: u8, extra_bytes: usize, count: usize, random: &mut Random) -> Vec<u8> {
    let (places, length) = (Places::of(format), length(format, extra_bytes));
    let mut record = vec![0; length];
    let (mut place, mut times, mut rgb, mut steps) = ([0i64; 3], [0i64; 4], [0u16; 3], [1i64; 4]);
    let mut all = Vec::new();
    for _ in 0..count {
        for (axis, coordinate) in place.iter_mut().enumerate() {
            *coordinate += random.step();
            record[4 * axis..4 * axis + 4].copy_from_slice(&(*coordinate as i32).to_le_bytes());
        }
        for byte in &mut record[12..if format >= 6 { 22 } else { 20 }] {
            if random.below(4) == 0 {
                *byte = byte.wrapping_add(random.step() as u8);
            }
        }
        if let Some(at) = places.time {
            let sequence = random.below(40).min(3) as usize;
            match random.below(30) {
                0 => times[sequence] = (random.below(1 << 31) << 32) as i64,
                1..4 => steps[sequence] = random.step(),
                4..10 => {}
                _ => times[sequence] += steps[sequence] * [1, 1, 1, 2, 30, 600, -3, -40][random.below(8) as usize],
            }
            record[at..at + 8].copy_from_slice(&times[sequence].to_le_bytes());
        }
        if let Some(at) = places.rgb {
            let is_grey = random.below(3) == 0;
            for band in 0..3 {
                rgb[band] = if is_grey { rgb[0] } else { rgb[band].wrapping_add(random.step() as u16) };
                record[at + 2 * band..at + 2 * band + 2].copy_from_slice(&rgb[band].to_le_bytes());
            }
        }
        if let Some(at) = places.wave_packet {
            change_wave_packet(&mut record[at..at + 29], random);
        }
        for byte in &mut record[length - extra_bytes..] {
            *byte = byte.wrapping_add(random.below(3) as u8);
        }
        all.extend(&record);
    }
    all
}

/// Returns the number of bytes of a record.
pub(super) fn length(format: u8, extra_bytes: usize) -> usize {
    Places::of(format).length + extra_bytes
}

/// Lets the waveform be the same, follow the one before, or lie near it or far from it.
fn change_wave_packet(packet: &mut [u8], random: &mut Random) {
    packet[0] = random.below(3) as u8;
    let offset = u64::from_le_bytes(packet[1..9].try_into().unwrap());
    let bytes = u32::from_le_bytes(packet[9..13].try_into().unwrap());
    let offset = match random.below(9) {
        0 => random.below(1 << 31) << random.below(33),
        1..3 => offset,
        3..5 => offset.wrapping_add_signed(random.step()),
        _ => offset.wrapping_add(bytes as u64),
    };
    packet[1..9].copy_from_slice(&offset.to_le_bytes());
    for number in packet[9..].chunks_exact_mut(4) {
        let integer = i32::from_le_bytes(number.try_into().unwrap());
        let next = if random.below(50) == 0 {
            random.below(1 << 32) as i32
        } else {
            integer.wrapping_add(random.step() as i32)
        };
        number.copy_from_slice(&next.to_le_bytes());
    }
}
