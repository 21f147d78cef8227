//! [`Lists`]: a list of results for each query of a batch.

use std::ops::Index;

use crate::threads::*;

use super::batch::GROUP;

/// A list of results for each query.
#[derive(Debug, Clone, PartialEq)]
pub struct Lists<T> {
    len: usize,
    /// Those of [`GROUP`] queries each, fewer in the last.
    groups: Vec<ListGroup<T>>,
    /// The number of values before each group, and of all.
    starts: Vec<usize>,
}

/// The lists of consecutive queries.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ListGroup<T> {
    /// The end of each list among the values.
    pub ends: Vec<usize>,
    pub values: Vec<T>,
}

/// The list that a value is in: its group, and its index in that group.
#[derive(Clone, Copy, Default)]
struct Place {
    group: usize,
    list: usize,
}

impl<T> Lists<T> {
    /// The lists of groups.
    pub(super) fn of(groups: Vec<ListGroup<T>>) -> Self {
        let mut count = 0;
        let mut starts = vec![0];
        starts.extend(groups.iter().map(|group| {
            count += group.values.len();
            count
        }));
        Lists { len: groups.iter().map(|group| group.ends.len()).sum(), groups, starts }
    }

    /// The number of lists.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The lists.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[T]> {
        (0..self.len()).map(|index| &self[index])
    }

    /// The number of values in all lists.
    pub fn values(&self) -> usize {
        self.starts[self.groups.len()]
    }

    /// The list of the value at `index` of all. Lists are searched from `hint` on.
    fn place_of(&self, index: usize, hint: Place) -> Place {
        let Place { mut group, mut list } = hint;
        if !(self.starts[group]..self.starts[group + 1]).contains(&index) {
            (group, list) = (self.starts.partition_point(|&start| start <= index) - 1, 0);
        }
        let (ends, index) = (&self.groups[group].ends, index - self.starts[group]);
        if list > 0 && ends[list - 1] > index {
            list = 0;
        }
        list += ends[list..].iter().take_while(|&&end| end <= index).count();
        Place { group, list }
    }
}

impl<T: Sync> Lists<T> {
    /// Calls `set` on all threads with each value, the index of its list, and the place of the value among `places`, of
    /// which there must be as many as [`Lists::values`].
    ///
    /// # Panics
    /// If there are more.
    #[cfg_attr(not(feature = "rayon"), allow(private_bounds))]
    pub fn par_each<P: Send>(
        &self,
        places: impl IndexedParallelIterator<Item = P>,
        set: impl Fn(P, usize, &T) + Sync + Send,
    ) {
        // A thread visits consecutive values, so that a value is mostly in the same list as the one before, or the next.
        places.enumerate().with_min_len(GROUP).for_each_init(Place::default, |last, (index, place)| {
            *last = self.place_of(index, *last);
            let Place { group, list } = *last;
            let value = &self.groups[group].values[index - self.starts[group]];
            set(place, group * GROUP + list, value);
        });
    }
}

impl<T> Index<usize> for Lists<T> {
    type Output = [T];

    fn index(&self, index: usize) -> &[T] {
        let ListGroup { ends, values } = &self.groups[index / GROUP];
        let list = index % GROUP;
        &values[list.checked_sub(1).map_or(0, |before| ends[before])..ends[list]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_with_their_lists() {
        // Lists of 0, 1, 2, 0, 1, 2, ... values; groups of which the second has none.
        let len = |list: usize| if list / GROUP == 1 { 0 } else { list % 3 };
        let count = 3 * GROUP + 5;
        let groups = (0..count).step_by(GROUP).map(|first| {
            let mut group = ListGroup { ends: Vec::new(), values: Vec::new() };
            for list in first..count.min(first + GROUP) {
                group.values.extend((0..len(list)).map(|k| (list, k)));
                group.ends.push(group.values.len());
            }
            group
        });
        let lists = Lists::of(groups.collect());
        assert_eq!(lists.len(), count);
        for (index, list) in lists.iter().enumerate() {
            assert!(list.iter().copied().eq((0..len(index)).map(|k| (index, k))));
        }
        let mut values = vec![(0, (0, 0)); lists.values()];
        lists.par_each(values.par_iter_mut(), |place, list, value| *place = (list, *value));
        let expected = (0..count).flat_map(|list| (0..len(list)).map(move |k| (list, (list, k))));
        assert!(values.into_iter().eq(expected));
        // From any place to any other.
        let places = [0, 1, 2 * GROUP - 1, 4000, 3, lists.values() - 1, 5];
        let of_values: Vec<usize> =
            (0..count).flat_map(|list| std::iter::repeat_n(list, len(list))).collect();
        let mut near = Place::default();
        for index in places {
            near = lists.place_of(index, near);
            assert_eq!(near.group * GROUP + near.list, of_values[index]);
        }
    }
}
