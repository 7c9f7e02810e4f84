//! Items sorted into numbered buckets, by counting.

use std::ops::Range;

use crate::parallel;

/// Items of some buckets, bucket by bucket in one list; within a bucket in the order in which they were
/// given.
#[derive(Clone, Debug, Default)]
pub struct Buckets<T> {
    /// First item of every bucket, and the number of items.
    starts: Vec<u32>,
    items: Vec<T>,
}

impl<T: Copy + Default> Buckets<T> {
    /// Sorts items, each given with its bucket, into `count` buckets; they are gone through twice.
    ///
    /// # Panics
    /// Where a bucket is not below `count`, and from 2^32 items on.
    pub fn new(count: usize, items: impl Iterator<Item = (usize, T)> + Clone) -> Self {
        let mut it = Self { starts: Vec::new(), items: Vec::new() };
        counting_sort(count, items, &mut it.starts, &mut it.items);
        it
    }
}

/// Hands the items of a range of rows to a function: the row, the columns in it, the item.
pub(crate) type ItemsOfRows<'a, T> = dyn Fn(Range<usize>, &mut dyn FnMut(usize, Range<usize>, T)) + Sync + 'a;

/// Cells from which on more than one thread sorts items into them.
const FOR_THREADS: usize = 1 << 16;

impl<T: Copy + Default + Send> Buckets<T> {
    /// Sorts items into the cells of a grid of so many columns and rows, each thread those of a band of rows. `items` is
    /// called twice for a band, and must hand on items in the same order whatever the rows.
    ///
    /// # Panics
    /// From 2^32 items on.
    pub fn of_rows([columns, rows]: [usize; 2], items: &ItemsOfRows<'_, T>) -> Self {
        let threads = if columns * rows < FOR_THREADS { 1 } else { parallel::threads() };
        let in_band = rows.div_ceil(threads).max(1);
        let band = |n: usize| n * in_band..rows.min((n + 1) * in_band);
        let mut starts = vec![0u32; columns * rows + 1];
        let bands = starts[..columns * rows].chunks_mut((in_band * columns).max(1));
        parallel::map_items(bands.collect(), |n, counts| {
            items(band(n), &mut |row, across, _| {
                counts[(row - band(n).start) * columns..][across].iter_mut().for_each(|n| *n += 1);
            });
        });
        // Now the start of every bucket; once its items are placed, its end.
        let mut sum = 0u32;
        for start in &mut starts {
            let count = std::mem::replace(start, sum);
            sum = sum.checked_add(count).expect("fewer than 2^32 items");
        }
        let mut sorted = vec![T::default(); sum as usize];
        let (mut parts, mut rest, mut begin) = (Vec::new(), &mut sorted[..], 0);
        let mut nexts = &mut starts[..];
        for n in 0..rows.div_ceil(in_band) {
            let (own, more) = nexts.split_at_mut(band(n).len() * columns);
            let end = more[0];
            let (part, after) = rest.split_at_mut((end - begin) as usize);
            parts.push((own, part, begin));
            (nexts, rest, begin) = (more, after, end);
        }
        parallel::map_items(parts, |n, (nexts, part, begin)| {
            items(band(n), &mut |row, across, item| {
                for next in &mut nexts[(row - band(n).start) * columns..][across] {
                    part[(*next - begin) as usize] = item;
                    *next += 1;
                }
            });
        });
        starts.rotate_right(1);
        starts[0] = 0;
        Self { starts, items: sorted }
    }
}

impl<T> Buckets<T> {
    /// All items, bucket by bucket.
    pub fn items(&self) -> &[T] {
        &self.items
    }

    /// How many buckets there are.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where in [`Buckets::items`] those of a bucket are.
    #[inline]
    pub fn range(&self, bucket: usize) -> Range<usize> {
        self.starts[bucket] as usize..self.starts[bucket + 1] as usize
    }

    /// The items of a bucket.
    #[inline]
    pub fn of(&self, bucket: usize) -> &[T] {
        &self.items[self.range(bucket)]
    }

    /// The items of every bucket, to be put in another order.
    pub fn each_mut(&mut self) -> impl Iterator<Item = &mut [T]> {
        let mut rest = &mut self.items[..];
        self.starts.windows(2).map(move |w| {
            let (bucket, more) = std::mem::take(&mut rest).split_at_mut((w[1] - w[0]) as usize);
            rest = more;
            bucket
        })
    }
}

/// A stable sort of items, each given with its key below `count`, into `sorted`; afterwards those of key k
/// are at `starts[k]..starts[k + 1]`. What both lists held before does not matter.
pub fn counting_sort<T: Copy + Default>(
    count: usize,
    items: impl Iterator<Item = (usize, T)> + Clone,
    starts: &mut Vec<u32>,
    sorted: &mut Vec<T>,
) {
    starts.clear();
    starts.resize(count + 2, 0);
    // Two places on: while items are laid down, `starts[k + 1]` says where the next one of key k goes. Behind
    // the last one that is where key k + 1 starts.
    items.clone().for_each(|(key, _)| starts[key + 2] += 1);
    for k in 1..starts.len() {
        starts[k] = starts[k].checked_add(starts[k - 1]).expect("fewer than 2^32 items");
    }
    sorted.resize(starts[count + 1] as usize, T::default());
    items.for_each(|(key, item)| {
        let next = &mut starts[key + 1];
        sorted[*next as usize] = item;
        *next += 1;
    });
    starts.pop();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_come_bucket_by_bucket_in_the_order_given() {
        let given = [(4, 'a'), (1, 'b'), (4, 'c'), (0, 'd'), (1, 'e')];
        let mut buckets = Buckets::new(6, given.into_iter());
        let all = |b: &Buckets<char>| (0..6).map(|k| b.of(k).iter().collect()).collect::<Vec<String>>();
        assert_eq!(all(&buckets), ["d", "be", "", "", "ac", ""]);
        assert_eq!((buckets.range(4), buckets.items().len()), (3..5, 5));
        buckets.each_mut().for_each(<[char]>::reverse);
        assert_eq!(all(&buckets), ["d", "eb", "", "", "ca", ""]);
        assert!(Buckets::<u32>::new(3, std::iter::empty()).of(2).is_empty());
    }

    #[test]
    fn items_of_rows_come_cell_by_cell_in_the_order_given_on_any_number_of_threads() {
        let [columns, rows] = [300, 270];
        let spread = |k: usize| (k * 7919 % rows, k * 104_729 % columns);
        let items = |of: Range<usize>, sink: &mut dyn FnMut(usize, Range<usize>, u32)| {
            for k in 0..90_000 {
                let (row, column) = spread(k);
                (row..rows.min(row + 1 + k % 3)).filter(|row| of.contains(row)).for_each(|row| {
                    sink(row, column..columns.min(column + 1 + k % 2), k as u32);
                });
            }
        };
        let mut flat = Vec::new();
        items(0..rows, &mut |row, across, k| flat.extend(across.map(|column| (row * columns + column, k))));
        let wanted = Buckets::new(columns * rows, flat.into_iter());
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let found = pool.install(|| Buckets::of_rows([columns, rows], &items));
            assert_eq!((&found.starts, &found.items), (&wanted.starts, &wanted.items), "{threads}");
        }
    }

    #[test]
    fn sorting_again_forgets_what_the_lists_held() {
        let (mut starts, mut sorted) = (vec![7; 9], vec![9; 20]);
        counting_sort(3, [(2, 5), (0, 6), (2, 4)].into_iter(), &mut starts, &mut sorted);
        assert_eq!((starts, sorted), (vec![0, 1, 1, 3], vec![6, 5, 4]));
    }
}
